#!/usr/bin/env python
import rosgraph
import rosnode
import rospkg
import rospy
import rostopic
from std_msgs.msg import String

rospy.init_node("graph_tool")
rospy.wait_for_message("chatter", String)
types = dict(rospy.get_published_topics())
print("chatter is %s" % types["/chatter"])
names = rosnode.get_node_names()
print("nodes %s" % [any(n.startswith(p) for n in names) for p in ("/talker", "/graph_tool", "/nobody")])
cls, topic, _ = rostopic.get_topic_class("/chatter")
print(cls._type, topic)
print("online %s" % rosgraph.is_master_online())
try:
    rospkg.RosPack().get_path("no_such_package")
except rospkg.ResourceNotFound as error:
    print("not found: %s" % str(error).splitlines()[0])
