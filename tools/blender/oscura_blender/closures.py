"""Shader nodes of surfaces. Those without a counterpart become a similar one, with a warning."""

from . import nodes
from .multiscatter import keeps_energy
from .node_links import as_triple, follow

# Inputs of closures that scene files have, by their type there.
INPUTS = {
    "principled_bsdf": "Base Color,Metallic,Roughness,IOR,Alpha,Diffuse Roughness,Subsurface Weight,Subsurface Radius,Subsurface Scale,"
    "Subsurface Anisotropy,Specular IOR Level,Specular Tint,Anisotropic,Anisotropic Rotation,Transmission Weight,Coat Weight,"
    "Coat Roughness,Coat IOR,Coat Tint,Sheen Weight,Sheen Roughness,Sheen Tint,Emission Color,Emission Strength,"
    "Thin Film Thickness,Thin Film IOR",
    "diffuse_bsdf": "Color,Roughness",
    "glossy_bsdf": "Color,Roughness,Anisotropy,Rotation",
    "metallic_bsdf": "Base Color,Edge Tint,Roughness,Anisotropy,Rotation",
    "glass_bsdf": "Color,Roughness,IOR",
    "refraction_bsdf": "Color,Roughness,IOR",
    "translucent_bsdf": "Color",
    "transparent_bsdf": "Color",
    "sheen_bsdf": "Color,Roughness",
    "velvet_bsdf": "Color,Roughness",
    "toon_bsdf": "Color,Size,Smooth",
    "toon_highlight_bsdf": "Color,Size,Smooth",
    "subsurface_scattering": "Color,Roughness,Scale,Radius,IOR,Anisotropy",
    "emission": "Color,Strength",
}

# Types of closures by shader node, and the description of the substitute for nodes without a counterpart.
CLOSURES = {
    "ShaderNodeBsdfPrincipled": ("principled_bsdf", None),
    "ShaderNodeBsdfDiffuse": ("diffuse_bsdf", None),
    "ShaderNodeBsdfAnisotropic": ("glossy_bsdf", None),
    "ShaderNodeBsdfMetallic": ("metallic_bsdf", None),
    "ShaderNodeBsdfGlass": ("glass_bsdf", None),
    "ShaderNodeBsdfRefraction": ("refraction_bsdf", None),
    "ShaderNodeBsdfTranslucent": ("translucent_bsdf", None),
    "ShaderNodeBsdfTransparent": ("transparent_bsdf", None),
    "ShaderNodeBsdfSheen": ("sheen_bsdf", None),
    "ShaderNodeBsdfToon": ("toon_bsdf", None),
    "ShaderNodeSubsurfaceScattering": ("subsurface_scattering", None),
    "ShaderNodeEmission": ("emission", None),
    "ShaderNodeBackground": ("emission", None),
    "ShaderNodeBsdfHair": ("diffuse_bsdf", "a diffuse surface"),
    "ShaderNodeBsdfHairPrincipled": ("diffuse_bsdf", "a diffuse surface"),
    "ShaderNodeEeveeSpecular": ("diffuse_bsdf", "a diffuse surface"),
    "ShaderNodeHoldout": ("diffuse_bsdf", "a black surface"),
}

# Volume shaders do nothing as a surface.
VOLUMES = ("ShaderNodeVolumeAbsorption", "ShaderNodeVolumeScatter", "ShaderNodeVolumePrincipled", "ShaderNodeVolumeCoefficients")

# Inputs that may not vary over a surface.
UNIFORM = {
    "IOR", "Anisotropic", "Anisotropic Rotation", "Anisotropy", "Rotation", "Subsurface Weight", "Subsurface Radius", "Subsurface Scale",
    "Subsurface Anisotropy", "Coat IOR", "Coat Tint", "Thin Film Thickness", "Thin Film IOR", "Edge Tint", "Scale", "Radius",
}  # fmt: skip

# Exceptions by closure.
VARYING = {("glass_bsdf", "IOR"), ("refraction_bsdf", "IOR")}

# Inputs that are read apart from the others, or that do nothing in Cycles.
OTHER_INPUTS = ("Weight", "Subsurface IOR", "Tangent", "IOR", "Extinction")


class SurfaceGraph(nodes.Graph):
    """The nodes of a material's surface."""

    def __init__(self, exposure, images, baker):
        super().__init__(images, baker)
        self.exposure = exposure
        self.displacement = None  # the entries of a displacement of vertices
        self.bump_mapping = None  # height, scale and exponent of the object's scale, of bump mapping by displacement
        self.bumps = None  # the reference to its normal, if a shader has it
        self._bumped_normal = None
        self.tangent_axis = None  # the axis of anisotropic reflection; empty for the UV map

    def shader(self, source):
        """The name of the node of a shader; None for none."""
        node, groups = source.node, source.groups
        if node is None or node.bl_idname in VOLUMES:
            return None
        if source.output.type != "SHADER":
            # Cycles takes a color as an emission.
            return self.new({"type": "emission", "color": self.value(source), "strength": self.exposure})
        if (node, groups) in self._written:
            return self._written[(node, groups)]
        if node.bl_idname in CLOSURES:
            return self.add(node, groups, self._split_subsurface(self._closure(node, groups)))
        if node.bl_idname == "ShaderNodeMixShader":
            entries = {"type": "mix_shader", "factor": self.value(follow(node.inputs[0], groups), "VALUE")}
        elif node.bl_idname == "ShaderNodeAddShader":
            entries = {"type": "add_shader"}
        else:
            self.baker.warn(f"the shader {node.bl_label} is not supported: it is rendered as a gray diffuse surface")
            return self.new({"type": "diffuse_bsdf"})
        for key, socket in zip("ab", node.inputs[-2:]):
            name = self.shader(follow(socket, groups))
            if name is not None:
                entries[key] = name
        return self.add(node, groups, entries)

    def _closure(self, node, groups):
        closure, similar = CLOSURES[node.bl_idname]
        if closure == "sheen_bsdf" and node.distribution == "ASHIKHMIN":
            closure = "velvet_bsdf"
        elif closure == "toon_bsdf" and node.component == "GLOSSY":
            closure = "toon_highlight_bsdf"
        if similar is not None:
            self.baker.warn(f"the shader {node.bl_label} is not supported: it is rendered as {similar}")
        entries = {"type": closure}
        if closure == "metallic_bsdf" and node.fresnel_type != "F82":
            entries.update(self._conductor(node, groups))
        self._put_inputs(entries, node, groups, INPUTS[closure].split(","))
        self._add_subsurface_settings(node, entries, groups)
        if node.bl_idname == "ShaderNodeHoldout":
            entries["color"] = [0.0, 0.0, 0.0]
        keeps = keeps_energy(node)
        if keeps is not None:
            entries["multiscatter"] = float(keeps)
        if closure in ("glass_bsdf", "refraction_bsdf", "glossy_bsdf") and node.distribution == "BECKMANN":
            entries["beckmann"] = 1.0
        self._add_bumps(entries)
        self._add_tangent(node, entries, groups)
        if closure in ("emission", "principled_bsdf"):
            self._expose(entries, "strength" if closure == "emission" else "emission_strength")
        return self._with_interior(node, entries, groups)

    def _put_inputs(self, entries, node, groups, known):
        """Writes the inputs that scene files have; others get a warning if they are linked."""
        for socket in node.inputs:
            if not socket.enabled or socket.type == "SHADER":
                continue
            name, source = socket.name, follow(socket, groups)
            if name == "Normal":
                value = source.value if isinstance(source.value, list) else [source.value or 0.0] * 3
                # An image texture without an image gives a constant.
                if source.node is not None or any(value):
                    entries["normal"] = self.value(source) if source.node is not None else value
            elif name in known:
                is_uniform = name in UNIFORM and (entries["type"], name) not in VARYING
                value = self.uniform(node, socket, groups) if is_uniform else self.value(source, socket.type)
                entries[name.lower().replace(" ", "_")] = value
            elif source.node is not None and name not in OTHER_INPUTS:
                self.baker.warn(f"{name} of {node.bl_label} is not supported")

    def _conductor(self, node, groups):
        """The colors of a metal with an index of refraction n + i k, at normal incidence and at 82 degrees (the model F82)."""
        n, k = (as_triple(self.uniform(node, node.inputs[name], groups)) for name in ("IOR", "Extinction"))
        cosine = 1 / 7
        base = [((a - 1) ** 2 + b * b) / ((a + 1) ** 2 + b * b) for a, b in zip(n, k)]
        schlick = [f + (1 - f) * (1 - cosine) ** 5 for f in base]
        edge = [min(_conductor_reflectance(a, b, cosine) / s, 1.0) for a, b, s in zip(n, k, schlick)]
        return {"base_color": base, "edge_tint": edge}

    # Subsurface scattering.

    def _add_subsurface_settings(self, node, entries, groups):
        """Of Random Walk (Skin) the index of refraction, which scales the radius; of Christensen-Burley an index of 0: light enters diffusely."""
        is_principled = entries["type"] == "principled_bsdf"
        if is_principled and entries.get("subsurface_weight", 0.0) == 0.0:
            return
        prefix = "Subsurface " if is_principled else ""
        method = getattr(node, "subsurface_method" if is_principled else "falloff", "")
        key = prefix.lower().replace(" ", "_")
        if method == "BURLEY":
            entries[f"{key}ior"] = 0.0
        if method == "RANDOM_WALK_SKIN":
            entries[f"{key}skin_ior"] = self.uniform(node, node.inputs[f"{prefix}IOR"], groups)

    def _with_interior(self, node, entries, groups):
        """A shader with the color of the medium inside, whose surface has the quotient of a varying color."""
        is_principled = entries["type"] == "principled_bsdf"
        if is_principled:
            weight = entries.get("subsurface_weight", 0.0)
            if weight == 0.0:
                return entries
            if not all(isinstance(entries.get(name, 0.0), float) for name in ("metallic", "transmission_weight")):
                message = f"subsurface scattering (weight {weight:.3g}) with varying Metallic or Transmission is rendered as diffuse reflection"
                self.baker.warn(message)
                return {**entries, "subsurface_weight": 0.0}
        elif entries["type"] != "subsurface_scattering":
            return entries
        key, name, interior = ("base_color", "Base Color", "subsurface_body") if is_principled else ("color", "Color", "body")
        if isinstance(entries.get(key), str):
            entries[interior] = self.baker.maximum(follow(node.inputs[name], groups), name)
        return entries

    def _split_subsurface(self, entries):
        """A mix of a shader with subsurface scattering of weight 1 and one without, where the weight is between: an object either is a
        scattering medium or not, and has neither metal nor glass then."""
        weight, metal, glass = (entries.get(name, 0.0) for name in ("subsurface_weight", "metallic", "transmission_weight"))
        if weight == 0.0 or not isinstance(weight, float):
            return entries
        share = weight * (1 - metal) * (1 - glass)
        if share >= 1.0:
            return entries
        if share <= 0.0:
            return {**entries, "subsurface_weight": 0.0}
        without = {key: value for key, value in entries.items() if key != "subsurface_body"}
        # The other part has all of the metal and the glass.
        metals, glasses = metal / (1 - share), (1 - metal) * glass / max(1 - share - metal, 1e-6)
        other = {**without, "subsurface_weight": 0.0, "metallic": metals, "transmission_weight": min(glasses, 1.0)}
        interior = {**entries, "subsurface_weight": 1.0, "metallic": 0.0, "transmission_weight": 0.0}
        return {"type": "mix_shader", "factor": share, "a": self.new(other), "b": self.new(interior)}

    # Normals and tangents.

    def _add_bumps(self, entries):
        """Adds bump mapping by displacement to a shader's normal."""
        if self.bump_mapping is None or entries["type"] in ("emission", "transparent_bsdf"):
            return
        self.bumps = self.bumped_normal()
        if "normal" not in entries:
            entries["normal"] = self.bumps
        elif not self._is_tangent_space_map(entries["normal"]):
            entries["normal"] = f"{self.new({**self._bump(), 'normal': entries['normal']})}.normal"

    def bumped_normal(self):
        if self._bumped_normal is None and self.bump_mapping is not None:
            self._bumped_normal = f"{self.new(self._bump())}.normal"
        return self._bumped_normal

    def _bump(self):
        height, scale, exponent = self.bump_mapping
        return {"type": "bump", "strength": 1.0, "height": height, "distance": scale, "object_scale": exponent}

    def _is_tangent_space_map(self, normal):
        """Is a normal that of a tangent-space normal map, with bumps or not? In Cycles these don't have the bumps of displacement."""
        node = self.nodes.get(normal.rpartition(".")[0]) if isinstance(normal, str) else None
        if node is not None and node["type"] == "bump":
            return self._is_tangent_space_map(node.get("normal"))
        return node is not None and node["type"] == "normal_map" and node["space"] == "tangent"

    def _add_tangent(self, node, entries, groups):
        """Notes the tangents of anisotropic reflection, which the mesh must have: around an axis, or along its UV map."""
        if not any(entries.get(name, 0.0) != 0.0 for name in ("anisotropic", "anisotropy")) or "Tangent" not in node.inputs:
            return
        tangent, axis = follow(node.inputs["Tangent"], groups).node, "Z"
        if tangent is not None and tangent.bl_idname != "ShaderNodeTangent":
            self.baker.warn("tangents other than those of a Tangent node are not supported: anisotropic reflection is around the local z axis")
        elif tangent is not None:
            axis = "" if tangent.direction_type == "UV_MAP" else tangent.axis
        if axis and "normal" in entries:
            self.baker.warn("anisotropic reflection is along the UV map, not around an axis, since the normal is mapped")
            axis = ""
        if self.tangent_axis is None:
            self.tangent_axis = axis

    def _expose(self, entries, key):
        strength = entries.get(key)
        if self.exposure == 1.0 or strength is None:
            return
        is_constant = isinstance(strength, float)
        product = {"type": "math", "operation": "multiply", "a": strength, "b": self.exposure}
        entries[key] = strength * self.exposure if is_constant else self.new(product)


def _conductor_reflectance(n, k, cosine):
    """Fresnel's equations for unpolarized light and an index of refraction n + i k."""
    squared, both = n * n + k * k, 2 * n * cosine
    s = (squared - both + cosine**2) / (squared + both + cosine**2)
    p = (squared * cosine**2 - both + 1) / (squared * cosine**2 + both + 1)
    return 0.5 * (s + p)


def has_subsurface(entries):
    """Does a shader, as it is written, scatter light below the surface?"""
    if entries["type"] != "principled_bsdf":
        return entries["type"] == "subsurface_scattering"
    weights = [entries.get(name, 0.0) for name in ("subsurface_weight", "metallic", "transmission_weight")]
    return weights == [1.0, 0.0, 0.0]
