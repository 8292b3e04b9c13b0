//! Runnable examples of pbig; each file beside this one is a program of its own.
