"""Online identification: filtered regression, recursive least squares, joint EKF, session."""
