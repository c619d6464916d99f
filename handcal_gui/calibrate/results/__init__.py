"""The results panel: eye shifts, residuals and convergence."""
