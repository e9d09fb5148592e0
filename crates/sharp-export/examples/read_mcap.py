"""Reads an MCAP file of `sharp export` or `sharp run --record`: python read_mcap.py FILE.mcap"""

import sys
from collections import Counter

from mcap.reader import make_reader
from mcap_ros2.decoder import DecoderFactory

counts, last = Counter(), {}
with open(sys.argv[1], "rb") as file:
    reader = make_reader(file, decoder_factories=[DecoderFactory()])
    assert reader.get_header().profile == "ros2"
    for schema, channel, _, message in reader.iter_decoded_messages():
        counts[channel.topic, schema.name] += 1
        last[channel.topic] = message
for (topic, kind), count in sorted(counts.items()):
    print(f"{topic} {kind} {count}")
grid, odometry = last["/map"], last["/odom"]
assert len(grid.data) == grid.info.width * grid.info.height and set(grid.data) <= {-1, 0, 100}
place = odometry.pose.pose.position
print(f"ends at {place.x:.2f}, {place.y:.2f}; {last['/sharp/outcome'].data}; odds {last['/sharp/odds'].data:.3f}")
