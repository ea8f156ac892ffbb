"""Driver, grasp tables, trace and emulator of the Prensilia IH2 Azzurra hand.

The modules at this level and in `emulator` need pyserial alone; only `ros` imports ROS.
"""
