"""Elastic housings: description or arrays -> mesh -> full model -> reduced body (`gearfe.ModalBody`).

housing = gearfe.housing_from_job("geometry/housing.toml")
body = housing.reduce()
body.save("housing.npz")

``build`` goes from a table to a mesh, ``model`` holds the full model, ``attachments`` bores and planes, ``body`` the
reduced body.
"""
