"""The tools behind ./coglab: demo, test runner, benchmarks, launch, doctor."""
