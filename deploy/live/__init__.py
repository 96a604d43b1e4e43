"""Access to a running network for the commands: connect, find topics and services, measure, show and publish."""
