#pragma once

#include <cstdint>
#include <string>
#include <string_view>

// What a scene is called inside of the server. Ids are unique within a project only, so tables,
// folders and, once a call is authorised, names of resources have a key in the place of the id: the
// id itself where no scene has that key, as all have from before ids were the project's own; else
// "NUMBER@ID", the number unique in the database. No id has an '@'.
namespace pepeseg {

std::string MakeSceneKey(int64_t number, std::string_view id);
bool IsSceneKey(std::string_view text);
// The id in a key.
std::string SceneIdOf(std::string_view key);
// A key of this id that no scene has.
std::string NoSceneKey(std::string_view id);
// `text` with ids in the place of the keys in names of resources ("scenes/KEY..."): for clients.
std::string WithSceneIds(std::string_view text);

}  // namespace pepeseg
