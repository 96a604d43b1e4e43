#!/usr/bin/env python
import rospy

rospy.init_node("durations")
t = rospy.Time(12, 500000000)
d = rospy.Duration(0.75)
print("%s %s %.2f" % ((t + d).secs, (t - d).nsecs, (t - rospy.Time(10)).to_sec()))
print("%s %s %s" % (d * 2 == rospy.Duration.from_sec(1.5), d / 3 < d, rospy.Duration(-1, 250000000).to_sec()))
print("%r %s" % (rospy.Time(1, 5), t.to_nsec()))
try:
    t + t
except TypeError:
    print("times do not add")
rate = rospy.Rate(20)
began = rospy.get_time()
for i in range(20):
    rate.sleep()
took = rospy.get_time() - began
print("a second: %s" % (abs(took - 1.0) < 0.06))
rospy.sleep(0.35)
left = rate.remaining()
print("late: %s" % (left.to_sec() < 0))
began = rospy.Time.now()
rospy.sleep(rospy.Duration(0, 500000000))
print("half: %s" % (0.49 < (rospy.Time.now() - began).to_sec() < 0.56))
