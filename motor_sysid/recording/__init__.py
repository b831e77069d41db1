"""Bags and CSV files to and from `Record`, through msg_config files.

`motor_sysid.recording.writer.BagWriter` and `motor_sysid.recording.save.write_record` write.
"""

from motor_sysid.recording.load import load, Loaded
from motor_sysid.recording.msg_config import load_msg_config
from motor_sysid.recording.sources import MsgConfig

__all__ = ['Loaded', 'MsgConfig', 'load', 'load_msg_config']
