//! One M_CAN controller with its message memory as a model of registers.
