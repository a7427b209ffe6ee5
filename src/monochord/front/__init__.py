"""The commands as functions: one file each, with the name, the arguments and the result of its command.

``import monochord as mc`` hands them out as ``mc.collect``, ``mc.build`` and so on; a command's file parses,
calls its function and prints.
"""
