#!/usr/bin/env python
import threading
from collections import deque

import rospy
from std_msgs.msg import Int32


class Relay(threading.Thread):
    def __init__(self):
        super(Relay, self).__init__()
        self.condition = threading.Condition()
        self.queue = deque()
        self.done = False
        self.sent = []
        self.pub = rospy.Publisher("relayed", Int32, queue_size=10)
        self.start()

    def put(self, value):
        self.condition.acquire()
        self.queue.append(value)
        self.condition.notify()
        self.condition.release()

    def stop(self):
        self.done = True
        self.put(None)
        self.join()

    def run(self):
        while not self.done or self.queue:
            self.condition.acquire()
            if not self.queue:
                self.condition.wait(0.5)
            items = list(self.queue)
            self.queue.clear()
            self.condition.release()
            for item in items:
                if item is not None:
                    self.pub.publish(item)
                    self.sent.append(item)


if __name__ == "__main__":
    rospy.init_node("workers")
    relay = Relay()
    lock = threading.Lock()
    total = [0]

    def producer(start):
        for i in range(5):
            with lock:
                total[0] += 1
            relay.put(start + i)
            rospy.sleep(0.05)

    threads = [threading.Thread(target=producer, args=(100 * n,)) for n in range(3)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    rospy.sleep(0.2)
    relay.stop()
    print("total %d, sent %d, sum %d" % (total[0], len(relay.sent), sum(relay.sent)))
