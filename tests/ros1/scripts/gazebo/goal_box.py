#!/usr/bin/env python
import rospy
from gazebo_msgs.msg import ModelStates
from gazebo_msgs.srv import DeleteModel, SpawnModel
from geometry_msgs.msg import Pose

SDF = """<?xml version='1.0'?>
<sdf version='1.4'><model name='goal'><static>1</static><link name='link'>
<visual name='v'><geometry><box><size>0.4 0.4 0.01</size></box></geometry></visual>
</link></model></sdf>"""


class Respawn():
    def __init__(self):
        self.goal_position = Pose()
        self.goal_position.position.x = 2.0
        self.goal_position.position.y = 1.0
        self.modelName = 'goal'
        self.check_model = False
        self.sub_model = rospy.Subscriber('gazebo/model_states', ModelStates, self.checkModel)

    def checkModel(self, model):
        self.check_model = "goal" in model.name

    def respawnModel(self):
        while True:
            if not self.check_model:
                rospy.wait_for_service('gazebo/spawn_sdf_model')
                spawn_model_prox = rospy.ServiceProxy('gazebo/spawn_sdf_model', SpawnModel)
                spawn_model_prox(self.modelName, SDF, 'robotos_name_space', self.goal_position, "world")
                while not self.check_model:
                    rospy.sleep(0.05)
                break

    def deleteModel(self):
        while True:
            if self.check_model:
                rospy.wait_for_service('gazebo/delete_model')
                del_model_prox = rospy.ServiceProxy('gazebo/delete_model', DeleteModel)
                print("deleted %s" % del_model_prox(self.modelName).success)
                break


rospy.init_node("goal_box")
respawn = Respawn()
for i in range(2):
    respawn.respawnModel()
    print("there %s" % respawn.check_model)
    respawn.deleteModel()
    while respawn.check_model:
        rospy.sleep(0.05)
print("gone %s" % (not respawn.check_model))
