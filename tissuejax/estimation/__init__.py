"""What fit and diagnosis both rest on: noise in time, its estimate, and tests of what is left."""
