"""Light linking and shadow linking, which are not carried over: what they say, by name."""

from .report import listed


def tell(obj, report):
    """Says what the light of an object, a lamp or one that shines, is restricted to."""
    linking = getattr(obj, "light_linking", None)
    if linking is None:
        return
    if linking.receiver_collection is not None:
        told = _linked(linking.receiver_collection)
        report.warn(obj.name, f"light linking is not supported: it lights everything, not what its collection says ({told})")
    if linking.blocker_collection is not None:
        told = _linked(linking.blocker_collection)
        report.warn(obj.name, f"shadow linking is not supported: everything blocks its light, not what its collection says ({told})")


def _linked(collection):
    """What a collection of links holds, by name."""
    parts = []
    for members, links in ((collection.objects, "collection_objects"), (collection.children, "collection_children")):
        states = [entry.light_linking.link_state for entry in getattr(collection, links)]
        for state, what in (("INCLUDE", ""), ("EXCLUDE", "without ")):
            names = [member.name for member, of in zip(members, states) if of == state]
            parts += [f"{what}{listed(names)}"] if names else []
    return "; ".join(parts) or "nothing"
