#!/usr/bin/env python
# -*- coding: utf-8 -*-
import rospy
import sys
from std_msgs.msg import String

class Old:
	def __init__(self):
		self.rooms = {'k\xc3\xbcche': 1, 'hall': 2}
		if self.rooms.has_key('hall'):
			print 'hall:', self.rooms['hall']

	def risky(self):
		try:
			raise ValueError, 'old style'
		except ValueError, e:
			print 'caught %s' % e

	def numbers(self):
		for i in xrange(3):
			print i,
		print
		print >>sys.stderr, 'to the other stream'
		print '%d rooms' % len(self.rooms.keys()), sorted(self.rooms.values())[0]
		if 1 <> 2:
			print 0755, 10L, `[1, 2]`
		exec "x = 3"

if __name__ == '__main__':
	rospy.init_node('python2')
	old = Old()
	old.risky()
	old.numbers()
	pub = rospy.Publisher('old', String)
	pub.publish(String('x'))
