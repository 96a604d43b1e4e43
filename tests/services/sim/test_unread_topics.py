"""Messages without a subscriber aren't created; a new subscriber gets every sample from then on."""

from __future__ import annotations

from messages.topics import CAMERA_INFO, IMAGE, IMU, JOINT_STATES, ODOM, ROBOT_DESCRIPTION, SCAN, TF
from services.runtime.subscriber import Subscriber
from tests.services.sim.drive.simulation_harness import NAME, run_simulation


def test_a_reader_gets_every_sample_from_when_it_began_and_before_that_none_is_made() -> None:
    with run_simulation("burger") as world:
        sent = {each.name: each for each in world.node.publishers}
        world.run(1.0)
        for topic in (JOINT_STATES, IMU, SCAN):
            assert sent[f"/{NAME}/{topic.name}"].sent == 0, topic.name
        assert sent["/tf"].sent == 0
        assert sent[f"/{NAME}/odom"].sent == 25
        for topic in (JOINT_STATES, IMU, SCAN):
            world.subscribe(topic)
        frames = Subscriber(TF, "/tf", "tf", world.node.transport)
        world.run(1.0)
        world.publish_state()
        # An IMU measures between two readings: the first gives nothing.
        for topic, count in ((JOINT_STATES, 26), (IMU, 100), (SCAN, 6), (ODOM, 51)):
            stamps = [each.header.stamp.ns for each in world.received(topic)]
            assert len(stamps) == count, topic.name
            assert stamps == sorted(set(stamps))
            assert stamps[-1] == 2_000_000_000
        frames.update()
        assert len(frames.messages) == 26
        assert {each.child_frame_id.rpartition("/")[2] for each in frames.messages[0][0].transforms} == {
            "base_footprint",
            "wheel_left_link",
            "wheel_right_link",
        }, "odometry that was due before is there from the first message on"
        assert sent[f"/{NAME}/{ROBOT_DESCRIPTION.name}"].sent == 1


def test_the_calibration_of_a_camera_needs_no_subscriber_of_its_images() -> None:
    with run_simulation("waffle") as world:
        world.subscribe(CAMERA_INFO)
        world.run(1.0)
        told = world.received(CAMERA_INFO)
        assert len(told) in (10, 11)
        assert {each.header.frame_id for each in told} == {f"{NAME}/camera_rgb_optical_frame"}
        sent = {each.name: each.sent for each in world.node.publishers}
        assert sent[f"/{NAME}/{IMAGE.name}"] == 0
