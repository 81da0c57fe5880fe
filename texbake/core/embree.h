/* The structures of Embree 4 that its queries for 16 rays take, and the queries.

   Based on: the API manual of Embree 4, RTCRayHit16 and RTCIntersectArguments. */

#ifndef TEXBAKE_EMBREE_H
#define TEXBAKE_EMBREE_H

#include <stdint.h>

#define PACKET 16 /* rays of a query */
#define COHERENT (1u << 16)
#define ALL_FEATURES 0xffffffffu
#define INVALID 0xffffffffu

/* RTCRayHit16 */
struct ray_packet {
    float origin[3][PACKET], near[PACKET], direction[3][PACKET], time[PACKET], far[PACKET];
    uint32_t mask[PACKET], id[PACKET], flags[PACKET];
    float normal[3][PACKET], u[PACKET], v[PACKET];
    uint32_t primitive[PACKET], geometry[PACKET], instance[PACKET], instance_primitive[PACKET];
};

/* RTCIntersectArguments, and RTCOccludedArguments, which has the same fields. */
struct query_arguments {
    uint32_t flags, feature_mask;
    void *context, *filter, *intersect;
    float min_width_distance_factor;
};

/* rtcIntersect16 and rtcOccluded16: lanes that are valid (-1), the scene, rays and hits, arguments. */
typedef void (*packet_query)(
    const int32_t *valid, void *scene, struct ray_packet *packet, struct query_arguments *arguments);

#endif
