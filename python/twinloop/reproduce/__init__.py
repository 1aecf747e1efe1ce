"""The paper's tables and its figure 6, measured again on our quadrotor and shown beside its numbers."""
