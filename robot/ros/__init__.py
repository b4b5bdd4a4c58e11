"""ROS by way of rosbridge: frames and messages (pure), and the websocket that carries them."""
