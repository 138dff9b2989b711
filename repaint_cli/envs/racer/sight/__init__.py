"""What the car's camera and lidar see."""
