#!/usr/bin/env python
import rospy
from std_srvs.srv import Empty, EmptyResponse, SetBool, SetBoolResponse, Trigger, TriggerResponse

state = {"on": False}


def switch(req):
    state["on"] = req.data
    return SetBoolResponse(True, "on" if req.data else "off")


def as_dict(req):
    return {"success": state["on"], "message": "from a dict"}


def as_list(req):
    return [True, "from a list"]


def failing(req):
    raise ValueError("no such luck")


def nothing(req):
    return None


rospy.init_node("services")
rospy.Service("~switch", SetBool, switch)
rospy.Service("~as_dict", Trigger, as_dict)
rospy.Service("~as_list", Trigger, as_list)
rospy.Service("~failing", Trigger, failing)
rospy.Service("~nothing", Trigger, nothing)
rospy.Service("~empty", Empty, lambda req: EmptyResponse())
rospy.spin()
