"""Files: the one way to read and the one way to write; what is promised of both is on the page `docs/promises.md`."""

from spirillum.files.limits import checked_path, file_name, is_text, text_cell
from spirillum.files.locks import scratch_folder
from spirillum.files.netcdf import loaded_netcdf, netcdf_file, open_netcdf, write_dataset
from spirillum.files.reading import (
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
    atomic_folder,
    atomic_write,
    atomic_write_all,
    check_replaceable,
    claim_folder,
    guard_inputs,
    holds_only_own_files,
    netcdf_target,
    new_file,
    output_folder,
    output_target,
    results_folder,
    writable_target,
    write_text,
    written_by_us,
)
from spirillum.files.zarr_store import (
    Stored,
    chunk_key,
    is_whole,
    opened_store,
    region_files,
    store_files,
    store_target,
    write_pieces,
)
