"""What changes over time: keyed numbers and the air, with their integrals in closed form."""
