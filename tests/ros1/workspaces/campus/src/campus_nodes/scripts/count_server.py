#!/usr/bin/env python
import rospy
from campus_interfaces.srv import CountWords, CountWordsResponse

def count_words(request):
	return CountWordsResponse(len(request.words.split()))

rospy.init_node('count_server')
service = rospy.Service('count_words', CountWords, count_words)
print 'counting'
rospy.spin()
