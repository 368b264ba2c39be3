"""What is kept on disk between runs, and the one key by which it is found again."""
