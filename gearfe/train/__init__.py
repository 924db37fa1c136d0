"""Gear trains: rigid shafts with gears in an elastic or rigid housing, on the rigid core.

The path of a job: `gearfe.train_job` reads the tables and makes a `TrainScene`; `build_train` turns it into a `TrainModel`
(a `gearfe.rigid` system with its hinges eliminated); `simulate` integrates it and returns a `TrainResponse`.
"""
