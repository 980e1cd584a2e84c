#pragma once

#include <cstdint>
#include <string>
#include <string_view>

// Ids that clients choose, and the keys of scenes inside the server.
//
// Scene ids are unique within a project only. Tables, folders and, once a call is authorised,
// resource names therefore hold a scene's key in place of its id. The key is the id itself if no
// other scene has that key, else "NUMBER@ID", where the number is unique in the database. No id
// contains '@'.
namespace pepeseg {

// Returns whether `id` may be a project's id: 1 to 63 lower-case letters, digits and '-', starting
// with a letter and not ending with '-'.
bool IsRfc1034Label(std::string_view id);

// Returns whether `id` may be the id of a scene or label: 1 to 63 ASCII letters, digits, '_', '.'
// and '-', starting with a letter or a digit. So an id is never "." or "..", and never looks like a
// command-line option.
bool IsResourceId(std::string_view id);
// The rule of IsResourceId, for error messages.
inline constexpr char kResourceIdRule[] =
    "must be 1 to 63 of a-z, A-Z, 0-9, '_', '.' and '-', beginning with a letter or a digit";

// Returns "NUMBER@ID".
std::string MakeSceneKey(int64_t number, std::string_view id);
// Returns whether `text` is a resource id, with or without "NUMBER@" before it.
bool IsSceneKey(std::string_view text);
// Returns the id in a key.
std::string SceneIdOf(std::string_view key);
// Returns a key with this id that no scene has.
std::string NoSceneKey(std::string_view id);
// Returns `text` with the keys in resource names ("scenes/KEY...") replaced by ids, for clients.
std::string WithSceneIds(std::string_view text);

}  // namespace pepeseg
