"""The only room that imports private parts of Numba and LLVM; `door` says when it may be used."""
