#!/usr/bin/env python
import rospy

rospy.init_node("parameter_reader")
while not rospy.get_param("/house/ready", False):
    rospy.sleep(0.05)
rooms = rospy.get_param("/house/rooms")
print("lamps %d" % sum(room["lamps"] for room in rooms.values()))
print("kitchen %s heights %s" % (rospy.get_param("/house/rooms/kitchen"), rospy.get_param("/house/heights")))
print("private %s %s %s" % (rospy.get_param("~speed", 1.0), rospy.get_param("~list", []), rospy.get_param("~on")))
print("of another node %s" % rospy.get_param("/parameter_writer/speed"))
print("default %s" % rospy.get_param("nothing", "fallback"))
print("has %s %s" % (rospy.has_param("/house/rooms"), rospy.has_param("/house/cellar")))
print("found %s" % rospy.search_param("gain"))
rospy.delete_param("/house/rooms/hall")
print("left %s" % sorted(rospy.get_param("/house/rooms")))
try:
    rospy.get_param("/house/cellar")
except KeyError as error:
    print("KeyError %s" % error)
try:
    rospy.delete_param("/house/cellar")
except KeyError:
    print("nothing to delete")
print("mine %s" % sorted(name for name in rospy.get_param_names() if "/house" in name))
