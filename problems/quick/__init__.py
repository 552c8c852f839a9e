"""Small named problems of every kind of Program, solved in seconds: to compare methods on."""
