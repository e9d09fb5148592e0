"""Finds a route in what `sharp export PLAN --format geojson` or `sharp abstract` wrote:
python read_geojson.py FILE.geojson"""

import sys

import geojson
import networkx

with open(sys.argv[1]) as file:
    collection = geojson.load(file)
assert collection.is_valid, collection.errors()
graph, ids = networkx.DiGraph(), set()
for feature in collection["features"]:
    properties, geometry = feature["properties"], feature["geometry"]
    assert properties["id"] not in ids, "nodes and edges share one row of ids"
    ids.add(properties["id"])
    if geometry["type"] == "Point":
        graph.add_node(properties["id"], place=geometry["coordinates"])
    else:
        start, end = properties["startid"], properties["endid"]
        assert geometry["coordinates"][0] == [graph.nodes[start]["place"], graph.nodes[end]["place"]]
        graph.add_edge(start, end, weight=properties["cost"], **properties["metadata"])
planned = [edge for edge in graph.edges(data=True) if edge[2]["planned"]]
print(f"{graph.number_of_nodes()} nodes, {graph.number_of_edges()} edges, {len(planned)} on the plan")
if planned:
    route = networkx.shortest_path(graph, planned[0][0], planned[-1][1], weight="weight")
    print(f"route of {len(route)} nodes, {networkx.path_weight(graph, route, 'weight'):.1f} s")
