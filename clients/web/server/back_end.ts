// What all ways of the back end share.
import type { Channel } from './channel';
import type { Photographs } from './photographs';

export interface BackEnd {
  readonly channel: Channel;
  readonly photographs: Photographs;
}
