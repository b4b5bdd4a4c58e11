"""ROS through rosbridge: frames and messages (pure), and the websocket that carries them."""
