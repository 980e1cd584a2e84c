#pragma once

#include "kernels/render_scratch.h"

namespace pepeseg {

class Backend;

// Lists the entries: sorts the visible by depth (equal depths by index), then lists them tile by
// tile. Reads what ProjectGaussians filled; fills tile_first_entry, entry_visible and entry_slot.
// Inverts Splat::depth after a render of inverse depth. Out of memory is kept by `backend`.
void ListTileEntries(Backend& backend, RenderScratch& scratch);

}  // namespace pepeseg
