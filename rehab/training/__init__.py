"""The rules of training: what a step earns, which phase it belongs to, what a session adds up to.

Pure Python, standard library only: no Django, no input or output, no clock, no randomness. The same
steps and changes give the same result on any machine and at any later time.
"""
