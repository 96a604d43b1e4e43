from campus_interfaces.msg import Complex, Reading

ROOMS = ["kitchen", "hall", "attic"]


def reading_of(index, stamp):
    reading = Reading(room=ROOMS[index % len(ROOMS)], status=Reading.FAULTY if index == 4 else Reading.OK)
    reading.header.stamp = stamp
    reading.axes = [index, 2.0 * index, 0.5]
    reading.samples = [Complex(index, -1), Complex(real=0.5, imaginary=0.25)]
    reading.took.nsecs = 5000000
    return reading
