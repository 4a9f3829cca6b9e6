"""Which raw drive and which of its frames each KITTI odometry sequence consists of.

From the development kit of the odometry benchmark (devkit_raw_data_conversion: "mapping.txt"). Frame numbers
are those of the `_sync` folders, both ends included.
"""

from dataclasses import dataclass

from .errors import UserError


@dataclass(frozen=True)
class DriveRange:
    """Frames first_frame .. last_frame of a drive such as 2011_09_30_drive_0027."""

    drive: str
    first_frame: int
    last_frame: int

    @property
    def date(self) -> str:
        """The folder of the day, which holds the calibration."""
        return self.drive[:10]


SEQUENCES = {
    "00": DriveRange("2011_10_03_drive_0027", 0, 4540),
    "01": DriveRange("2011_10_03_drive_0042", 0, 1100),
    "02": DriveRange("2011_10_03_drive_0034", 0, 4660),
    "03": DriveRange("2011_09_26_drive_0067", 0, 800),
    "04": DriveRange("2011_09_30_drive_0016", 0, 270),
    "05": DriveRange("2011_09_30_drive_0018", 0, 2760),
    "06": DriveRange("2011_09_30_drive_0020", 0, 1100),
    "07": DriveRange("2011_09_30_drive_0027", 0, 1100),
    "08": DriveRange("2011_09_30_drive_0028", 1100, 5170),
    "09": DriveRange("2011_09_30_drive_0033", 0, 1590),
    "10": DriveRange("2011_09_30_drive_0034", 0, 1200),
}
WITHOUT_RAW_DATA = "03"


def sequence_range(sequence: str) -> DriveRange:
    """The drive and frames of a sequence "00" .. "10"."""
    name = sequence.zfill(2)
    if name not in SEQUENCES:
        raise UserError(f"--sequence {sequence}: only 00 to 10 have public ground truth and a known drive")
    if name == WITHOUT_RAW_DATA:
        raise UserError(
            f"--sequence 03: its raw data ({SEQUENCES[name].drive}) was withdrawn from the KITTI site: "
            "choose another "
            "sequence, or give a copy of the drive with --drive"
        )
    return SEQUENCES[name]
