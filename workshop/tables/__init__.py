"""What makes the tables of docs/results/: measurements that no campaign can do, and campaigns."""
