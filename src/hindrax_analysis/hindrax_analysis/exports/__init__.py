"""Identified coefficients as simulators and controllers want them: one module per format, `write(model) -> text`.

Every format has its own signs. Inside, drag and added mass are positive numbers that resist: the force on the vehicle
is -(k_q |x| x + k_l x) and -(A x'), SNAME axes (x forward, y starboard, z down).
"""
