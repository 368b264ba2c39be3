"""Cost of derivatives over the forward run: reverse mode to four parameters, forward Jacobian to five. Run as a script.

Prints a table and writes `results/gradient.json`: ratios of CPU time and the temporary memory that XLA plans.
"""

import jax
import jax.numpy as jnp
from bench_step import cpu, cube, write

from tissuejax.tled.simulate import COMPILER_OPTIONS, simulate

NAMES = ("C10", "C20", "C30", "C40")


def channels(x, scene):
    """Support force and the top's mean motion, to be differentiated to four constants and the bulk modulus."""
    values = {name: x[i] * scene.tissue.energy_values[name] for i, name in enumerate(NAMES)}
    bulk = {"K": x[4] * scene.tissue.volumetric_values["K"]}
    out = simulate(scene.put({"tissue.energy_values": values, "tissue.volumetric_values": bulk}))
    return jnp.concatenate([out.reaction.ravel(), out.state.u.mean(1)])


def program(f, *arguments):
    """Compiled, with the bytes of temporaries it plans for."""
    made = jax.jit(f, compiler_options=COMPILER_OPTIONS).lower(*arguments).compile()
    return made, made.memory_analysis().temp_size_in_bytes / 2**20


def main() -> None:
    figures = {}
    for steps in (50, 200):
        scene = cube(10, 4, jnp.float32, steps=steps)
        x = jnp.ones(5, jnp.float32)

        def four(y, x, scene):
            return jnp.sum(channels(jnp.concatenate([y, x[4:]]), scene) ** 2)

        def five(x, scene):
            return jax.vmap(lambda d: jax.jvp(lambda x: channels(x, scene), (x,), (d,))[1])(jnp.eye(5, dtype=x.dtype))

        programs = {
            "forward": (*program(channels, x, scene), (x, scene)),
            "reverse, 4 parameters": (*program(jax.grad(four), x[:4], x, scene), (x[:4], x, scene)),
            "Jacobian, 5 parameters": (*program(five, x, scene), (x, scene)),
        }
        best = dict.fromkeys(programs, float("inf"))
        for _ in range(4):
            for name, (made, _, arguments) in programs.items():
                best[name] = min(best[name], cpu(made, *arguments))
        figures[f"{20 * steps} steps, 1000 hexes"] = {
            name: {"over forward": round(best[name] / best["forward"], 2), "MiB": round(programs[name][1], 1)}
            for name in programs
        }
    write("gradient", figures)


if __name__ == "__main__":
    main()
