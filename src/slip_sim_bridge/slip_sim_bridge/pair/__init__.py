"""Two arms that hold one object in two elastic, slippery grasps: parameters, simulation and session, without ROS."""
