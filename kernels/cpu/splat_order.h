#pragma once

#include "kernels/render_scratch.h"

namespace pepeseg {

class Backend;

// From the visible and their runs of tiles to the entries: sorts the visible by depth (equal
// depths by index), then lists them tile by tile. Fills tile_first_entry, entry_visible and
// entry_slot.
void ListTileEntries(Backend& backend, RenderScratch& scratch);

}  // namespace pepeseg
