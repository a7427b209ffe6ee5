"""A server of pages in browsers: what every page needs, whatever it shows.

A page is a `Page` of `monochord.page.server`: a path, a tab's label, its files, and where it is live, a
`Feed` of `monochord.page.clients`, which encodes what is new once for all its browsers and takes their
requests. The run's page (`monochord.live.web`), the bring-up's (`monochord.bringup.web`) and the design's
(`monochord.page.design`) are such pages, and one server shows several of them beside each other.

- `server`: the server in one thread, with its address, its pages and their tabs.
- `serving`: runs it at an address as users write it, and prints its link.
- `clients`: the loop over the sockets of a page's browsers.
- `commands`: what a page may ask, by type of request, with the function that carries it out.
- `messages`: what is sent, as JSON.
- `guard`: which requests are let in, by host name, origin and token.
- `connections`: how many connections may be idle, and for how long.
- `design`: the page that designs a sensor, computed in another process.
- `static`: style, theme, charts and connection that the pages share.

Conventions: a program's threads store what is new and return at once; the server's thread encodes and sends
it. A slow browser gets fewer messages and delays nobody. A request that is refused changes nothing. The
server reads no path from a request but those of its pages, and no page needs anything from the internet.
"""
