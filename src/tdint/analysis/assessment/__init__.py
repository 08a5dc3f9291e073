"""What methods do: order, stability, overshoot, failures, the paper's examples."""
