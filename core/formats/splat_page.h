#pragma once

namespace pepeseg {

// The text of splat_page.html, the template of GaussianHtmlBlocks.
extern const char kSplatPage[];

}  // namespace pepeseg
