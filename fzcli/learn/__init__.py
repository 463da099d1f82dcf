"""Neural kinematics: networks trained on a robot's exact kinematics, stored, and checked whenever they are used."""
