"""What a Model's probing predicts, tabulated with its own measured error; asked at the speed of a hand."""
