#!/usr/bin/env python
import rospy
import tf
from gazebo_msgs.msg import LinkStates, ModelStates
from nav_msgs.msg import Odometry


class TrueOdom:
    def __init__(self):
        self.model = rospy.get_param("~model", "robot")
        self.pub = rospy.Publisher("true_odom", Odometry, queue_size=2)
        self.br = tf.TransformBroadcaster()
        self.count = 0
        rospy.Subscriber("/gazebo/model_states", ModelStates, self.states)
        self.links = rospy.wait_for_message("/gazebo/link_states", LinkStates).name

    def states(self, msg):
        try:
            i = msg.name.index(self.model)
        except ValueError:
            return
        odom = Odometry()
        odom.header.stamp = rospy.Time.now()
        odom.header.frame_id = "world"
        odom.child_frame_id = "true_base"
        odom.pose.pose, odom.twist.twist = msg.pose[i], msg.twist[i]
        self.pub.publish(odom)
        p, o = msg.pose[i].position, msg.pose[i].orientation
        self.br.sendTransform((p.x, p.y, p.z), (o.x, o.y, o.z, o.w), odom.header.stamp, "true_base", "world")
        self.count += 1


rospy.init_node("true_odom")
t = TrueOdom()
while t.count <= 5:
    rospy.sleep(0.1)
print("published %s, links %s" % (t.count > 5, [n for n in t.links if n.startswith(t.model)][0].split("::")[0]))
rospy.spin()
