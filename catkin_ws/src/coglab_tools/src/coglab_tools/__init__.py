"""The researcher's daily commands: teach, record, study, report. `python3 -m coglab_tools --help` lists them."""
