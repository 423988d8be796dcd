from .background import remove_background as remove_background
from .config import (
    Config as Config,
    Instrument as Instrument,
    Properties as Properties,
    ReportConfig as ReportConfig,
    read_config as read_config,
)
from .contact import Contact as Contact, find_contact as find_contact
from .drops import (
    Pulse as Pulse,
    Section as Section,
    cut_section as cut_section,
    find_drops as find_drops,
)
from .instruments import (
    Chain as Chain,
    Plate as Plate,
    RecorderFilter as RecorderFilter,
    correct as correct,
    instrument_uncertainties as instrument_uncertainties,
)
from .measured_drop import (
    Drop as Drop,
    Stages as Stages,
    measure_drop as measure_drop,
    measure_stages as measure_stages,
)
from .recorded_levels import average_levels as average_levels, measure_levels as measure_levels
from .repair import repair as repair
from .signal import Signal as Signal, open_signals as open_signals
