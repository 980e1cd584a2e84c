#pragma once

#include <string>

namespace pepeseg {

// All that a plain HTTP GET to a port of this machine answers, headers first; empty: nothing.
std::string HttpGet(int port, const std::string& path);

}  // namespace pepeseg
