#pragma once

#include "kernels/cpu/parallel_for.h"
#include "kernels/cpu/tile_cover.h"
#include "kernels/render_scratch.h"

namespace pepeseg {

class Backend;

// From visible_splat and visible_first_slot to the entries: sorts the visible by depth (equal
// depths by index), then lists them tile by tile. Fills tile_first_entry, entry_visible and
// entry_slot.
void ListTileEntries(Backend& backend, ThreadPool& pool, RenderScratch& scratch);

}  // namespace pepeseg
