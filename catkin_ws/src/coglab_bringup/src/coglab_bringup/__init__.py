"""The tools behind ./coglab: demo, test runner, bench frame, launch, doctor."""
