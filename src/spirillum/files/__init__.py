"""Files: the one way to read and the one way to write; what is promised of both is on the page `docs/promises.md`."""

from spirillum.files.folders import claim_folder, results_folder
from spirillum.files.names import checked_path, file_name, is_text, text_cell
from spirillum.files.netcdf import loaded_netcdf, netcdf_file, open_netcdf, write_dataset
from spirillum.files.reading import (
    checked_file,
    csv_rows,
    opened,
    parse_toml,
    read_bytes,
    read_json,
    read_text,
    read_toml,
)
from spirillum.files.writing import (
    MARK,
    PICTURES,
    check_replaceable,
    is_own,
    netcdf_target,
    new_file,
    output_folder,
    output_target,
    protected,
    whole_file,
    whole_files,
    whole_folder,
    write_text,
)

__all__ = [
    "MARK",
    "PICTURES",
    "check_replaceable",
    "checked_file",
    "checked_path",
    "claim_folder",
    "csv_rows",
    "file_name",
    "is_own",
    "is_text",
    "loaded_netcdf",
    "netcdf_file",
    "netcdf_target",
    "new_file",
    "open_netcdf",
    "opened",
    "output_folder",
    "output_target",
    "parse_toml",
    "protected",
    "read_bytes",
    "read_json",
    "read_text",
    "read_toml",
    "results_folder",
    "text_cell",
    "whole_file",
    "whole_files",
    "whole_folder",
    "write_dataset",
    "write_text",
]
