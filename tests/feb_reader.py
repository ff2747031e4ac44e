"""A reader of .feb files for tests; it knows FEBio's manual, and nothing of the writer."""

from xml.etree import ElementTree

import numpy as np

from fibrous.fe.boundary import PrescribedDisplacement


class Feb:
    """What a .feb file says, in arrays."""

    def __init__(self, content: bytes) -> None:
        self.root = ElementTree.fromstring(content)
        nodes = self.root.findall("Mesh/Nodes/node")
        self.place = {node.get("id"): number for number, node in enumerate(nodes)}
        self.node_position = self.numbers(nodes)
        elements = self.root.find("Mesh/Elements")
        self.element_type, self.part = elements.get("type"), elements.get("name")
        self.element_nodes = np.array([[self.place[one] for one in e.text.split(",")] for e in elements])
        materials = {material.get("name"): material for material in self.root.findall("Material/material")}
        domain = self.root.find("MeshDomains/SolidDomain")
        assert domain.get("name") == self.part
        self.material = materials[domain.get("mat")]

    @staticmethod
    def numbers(elements) -> np.ndarray:
        return np.array([[float(one) for one in element.text.split(",")] for element in elements])

    def data(self, **attributes) -> ElementTree.Element:
        """The element data with these attributes: one entry for each element of the part, in order."""
        (found,) = [
            data
            for data in self.root.findall("MeshData/ElementData")
            if all(data.get(name) == value for name, value in attributes.items())
        ]
        assert found.get("elem_set") == self.part
        assert [int(entry.get("lid")) for entry in found] == list(range(1, len(self.element_nodes) + 1))
        return found

    def parameter(self, parameter: ElementTree.Element) -> np.ndarray:
        if parameter.get("type") == "map":
            return self.numbers(self.data(name=parameter.text))[:, 0]
        return np.full(len(self.element_nodes), float(parameter.text))

    def material_axes(self) -> np.ndarray:
        """Columns e1 = a/|a|, e3 along a × d, e2 = e3 × e1, shape (elements, 3, 3)."""
        entries = self.data(type="mat_axis")
        a, d = (self.numbers([entry.find(name) for entry in entries]) for name in "ad")
        e1 = a / np.linalg.norm(a, axis=1, keepdims=True)
        e3 = np.cross(a, d)
        e3 /= np.linalg.norm(e3, axis=1, keepdims=True)
        return np.stack([e1, np.cross(e3, e1), e3], axis=-1)

    def families(self) -> list[tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]]:
        """ksi, alpha, beta, shape (elements,), and global directions, shape (elements, 3), of every fibre family."""
        solids = [solid for solid in self.material.findall("solid") if solid.get("type") == "fiber-exp-pow"]
        axes = self.material_axes()
        families = []
        for solid in solids:
            assert solid.find("fiber").get("type") == "vector"
            local = self.numbers([solid.find("fiber")])[0]
            families.append((*(self.parameter(solid.find(name)) for name in ("ksi", "alpha", "beta")), axes @ local))
        return families

    def prescribed(self, steps: int) -> PrescribedDisplacement:
        """Every prescribed component at the times of the steps, by its load curve or constant."""
        sets = {
            entry.get("name"): [self.place[node] for node in entry.text.split(",")]
            for entry in self.root.findall("Mesh/NodeSet")
        }
        size = float(self.root.find("Control/step_size").text)
        times = size * np.arange(1, steps + 1)
        curves = {}
        for controller in self.root.findall("LoadData/load_controller"):
            assert controller.get("type") == "loadcurve"
            assert controller.find("interpolate").text == "LINEAR"
            time, value = self.numbers(controller.find("points")).T
            assert time[0] == value[0] == 0.0
            curves[controller.get("id")] = np.interp(times, time, value)
        nodes, axes, values = [], [], []
        for condition in self.root.findall("Boundary/bc"):
            assert condition.get("type") == "prescribed displacement"
            value = condition.find("value")
            curve = curves[value.get("lc")] if value.get("lc") else np.ones(steps)
            for node in sets[condition.get("node_set")]:
                nodes.append(node)
                axes.append("xyz".index(condition.find("dof").text))
                values.append(float(value.text) * curve)
        return PrescribedDisplacement(np.array(nodes), np.array(axes), np.array(values).T)
