"""Formats of others: networks, meshes and their motion, ParaView, FEBio, NetCDF."""
