#pragma once

#include <string>

namespace pepeseg {

// Returns the whole answer, with headers, to a plain HTTP GET to a port of this machine. Empty:
// there is none.
std::string HttpGet(int port, const std::string& path);

}  // namespace pepeseg
