#!/usr/bin/env python
import sys
import rospy
from campus_interfaces.srv import CountWords

rospy.init_node('count_client')
rospy.wait_for_service('count_words')
counter = rospy.ServiceProxy('count_words', CountWords)
words = ' '.join(rospy.myargv(sys.argv)[1:]) or 'four words are here'
response = counter(words)
print words, '->', response.count
