"""Files that OpenVDB 10 wrote, compressed by Blosc with LZ4, as it does by itself; here packed by zlib once more.

BALL: a level set of a ball of 0.32 m about 0.4, 0.4, 0.4 m, voxels 0.1 m, and beside it a grid of truth values;
HALF: the ball in 16 bits a value. WILD: tiles, values of both kinds off the mask, and scattered voxels, as
`wild` tells. TWO: two grids of floats.
"""

import base64
import random
import zlib

import numpy as np
from numpy.typing import NDArray

CENTRE_M, RADIUS_M, EDGE_M = 0.4, 0.32, 0.1


def wild() -> tuple[NDArray[np.float32], NDArray[np.bool_]]:
    """What the file holds from voxel (-8, 0, 0) on: values (24, 8, 16), and which are active."""
    value, active = np.full((24, 8, 16), 3.0, np.float32), np.zeros((24, 8, 16), bool)
    value[:16], active[:16] = 0.75, True
    draw = random.Random(3)
    for _ in range(120):
        place = (8 + draw.randrange(16), draw.randrange(8), draw.randrange(8))
        value[place], active[place] = round(draw.gauss(0, 1), 2), True
    for place, off in (((9, 2, 3), -3.0), ((17, 1, 1), 0.5), ((18, 1, 1), 0.25)):
        value[place], active[place] = off, False
    return value, active


def _unpacked(text: str) -> bytes:
    return zlib.decompress(base64.b64decode(text))


_BALL = (
    "eNrt3f9LG2ccB/DPffFLxat2tZ1zc3O0GEaR2sYmN2diCTKYc6xptlkKwcV4HlmjKY1RC/3B0o0Joz/5k9C6QTbG8ttoGR16pStzMtlg/UHSHyz0"
    "Hzia0S9QNsyeu9zVGKN2tS1r937B9XO557nc87k89wT0g23wdXxEzE22VVAOF2pWXEp/uK9JCbtbmlr6nc6mN929B5pC/S37esNKszvkUoyOPNtE"
    "tg2E4seqWPzghKL09MZi0Z4DPS09TqPLqPWeXzTm4ouOXCy1Nolt/ZEoO603NtozEBotYQeGlbAzUmmMJG8r6BkZXNEzX7XdMxwbOH5CiccjsUHj"
    "WvGhE5FBdQfb643G4uGGPQ2h8FBkWGkYDkUTSnyrfdqAMtDTe3JIiRtXiAwOuVrK2c6V78SV7z4cG1Wi7BqJwaEVHcutYRjdB0MDyvKl8+/Vh4OR"
    "/tiJgUA4FFXeCx3PnZJpf7Lx5qrI2TeNK7iJha8BAAAAAAAAAAAAAAAAAADgGVRtRZ5zmoUPnHUMhQEAWBhWLQyCkDtux39rs+c/zvcyEusNRaNG"
    "XmZVW380FhpaLmt73ypja5nJxVd+zkWj1suo/zIKwsLRUDy+XPy1he1FlWEl2hBXhtYve9uSt61f9pbN84hlb9vs0/qUaOik0tfDMu0zrtpjHzEO"
    "vMsOlOXdXyu2rRE9VodvrddfW/EbK25Qa1f7xwsPptq6tXZ9/PLntbrWzvgEi9fafTU5+WP7w0Y2wf/KZncdLIwijd3OZo+sirn27cUi/f5bl9ce"
    "MGWyWSwnAAAAAAAAAE8PfqoNAAAAAAAAAE/cWlU18HzDD57gaS8Msixbe/+BCiQ8AAAAAAAAAAAAAAAAAAAAAI/JoxUZ4Ff3AFgYVpPXiKvlKpDG"
    "cKcBAAAAAAAAAAAAAAAAAACecWsWGYzh3gBgYXj46qOxsbGicU0oYgQAAAAAAAAAAAAAAAAAAHgOrFVkIGxQGoDCAYD/4cJA8qmlpaVTsry0lM1m"
    "2Z4RjB32zy1jh4W5W2Y0X9vtdv/8NYTjrGDscJwgCGynMNrtD/rn2H9U6ZQVl+Ti8VRBf3v8lP8/wT0dueu15N3Y3Szuto5l1C5vKuHz2lH3yyte"
    "G3GjC6wRlz2hiz9c3dmmLr7JaSdk586w+XNmbs6cRGyPs+ZgwReaHe12u/8BwR786+LfpUTGZhyrYceusO12WUpPaWqnqqVUNaCqKb0zIAU69a3E"
    "19GdGj3FmjPBC+qFYCYY0B16IJi6oNc56/QLuupwktOhVpPwGglNxLWTsJ3ubNECDmolR0DVqXu+m/ROR+v82flWRzWJDSTsJeE0iUdIbKQ7pNZ1"
    "q361uy7gnPf7551VJL5GIuvxC4lTJEZJcFFAorNnqZLEl0ncQ1WjtKfqT3qjKsy9esgcVC6HhD9xf6Jj4n5iYlwan0j4O6S01OG3cvAnWLM61T3e"
    "PaVOSYv1i9JUonuxxl2z2O0fr3en3fXjhTncl46m96ePShOL6YuRi+nFjvr9kauR/fVFchivuei/4b9YI7kjN25E3EVzSKevXk37iuVgDiqXg0/2"
    "NUm81OSTFrQFySfzWlLjZSsH2ceau2r1Bb22q1YLNga1Wp8ebB9pD+ryQuNIcqRxoTCHJu16sjZ5XZOCycnZyWSQb6ydvTtb21gkh4X2yZ2unZPt"
    "2sisyzU7UjSHZPLu3WTRz8Ec1DWWww4vR80ej6eSKsqojCf+Jar2sGlYRt+3Tbd5PF6PZ3pmupzEaipxkPiWMc6M4Gmb0WbaWOOMpmkzLGoclZmD"
    "pGbi3cSVknCEeBcbp6dNu3z5stbmmWZRmzbHWbKX6G3ivCRMER2j3ZrHRdUzp4k373fJr1TSagx3F/FEPxG9Q+I14qep9BNjGLmLsAWHayXuB+IP"
    "kniGWFLiIZaG17vpRf/LB0vHPvESi5esY8bT9znb7kl5T18mkFIz5gOYkvRAqlOvIX4X3avSU3nTW5US46o5wxNpv5To8Fud/Im8+dOl+Ra6zCnk"
    "S8qaj5fNTgdkH/uAtnnYjagiKqfKCvrYa9r0l9O5Inmes/L8tDBPY5XJpDLWQsMaiuVpPMZqQrWeZNZQLE/jOenydVmPCmvIy9NpTsSqCuLsJDf7"
    "DXq+SJLnrSQ/22gpPawbOZeuv1Yd9hs5l66/GByWjZxLVz5tpTwdMrP8B027UBQ="
)
_HALF = (
    "eNrt3d9rHFUUB/CzP9Jua2vidpWq4G4UCtl0NncmP7qFokFEFKwK/sCHwjKZTHTJTDZkt6GFIFv7B9gHX0peqrBQYdk2VizmqXQJeTL4J/i4bxsQ"
    "H0Ih6zk7M5vtJqWt0aL1+4GbM3Pn7twz585OIB1o6s23PiX2G7fD5Amp0/rUhJm1NEsft7WxU1ZWM8fGprXsKWXPjBunR8dnJtoDuUW5TZmO8xLH"
    "jxdsOzfjFMxSbjw3lhvNvWM6M2/Lvoy+7J/+l2+8uLLsxQPcDnHr42Y5ZrEoHcXSQn7uc+l27EXbSRXt0lHemck7dm5qqnAh55oX5AOLtjWaP+Kf"
    "IWg9I/Nz941sdRkIRloFd37BLhbzhbmd6Z+Xa3MKRSs1nDKtUn7RTi2aznm7+FzwsWnbMS/a0zm+xmmZNRf0SMe73HGQOiLcpGzhkB4tcyz7+wlu"
    "r3BLpSlMeoRKYeoPUV8ycpyi/WFKf9j+9LPBlK7t5qYuluyiXFR+rjQxFuON47/G28M6F7RYuGA7fFnn50r3DZwOe9m8IJ3FXNFc5PTNYu4LXipv"
    "7dorWig4sroh2ZkzXXunKMGC93P8ZC4/U1hwP7JMxz5rznPPtatXf37jUSPPcK/Vem2yN0ap/Hur9dmu6B0/tlckuvPe6+Tfj7TZahEAAAAAAAAA"
    "PDEhlAAAAAAAAAAAAPYDf2CCf0o2m/W3/gVvFOFGBwAAAAAAAAAAAAAAAAAAeCLwT/QA/2fZB8TdvDeKyigZAAAAAAAAAAAAAAAAAADAf10ZJQCA"
    "PR4N5fKe8YHw8iEAAAAAAAAAAAAAAAAAAMBTIPKQVwDwggDA0yy7tL29vZTNbm+3Wi3ekiAb/KMpGxzWm+3Y3g+OB+O7nxWhkB9kIxSKRCK80RuD"
    "453xfhp+XPLjdnbvuNQzPsifuv/ntSdUufZ8r/p74dBoNM5xwO+zjIQhra570TIedroHxB1/y1SP9o7YY0y1zxso0lq/zHfC5fX19u3AWyH/bur5"
    "FRTE4Hgw/l44SHUw+mWE7xBu0nec+/7g+CPHm4mE6yaq1UQ8GT9Im328k6hbs7NWQ28kmqvNup7UY7R5eK3ZXFurrs3H5/nAfP1u3U0OJ+N3a3dj"
    "7RIMknIb7kmiY7QZq27c3mgM317dunVrq7mx0Zzd2prl039ANEH0MqWStQP0tT48rFdXV6tn6EjKdU2abCSTjfeJxom8U35PkwmeMUU0Q3SWrslZ"
    "eG7O7QfO+zvDUMrIZAylcdpRZRi6MTJiaEOakV5O60OVIclapdNKZZSudD6gn7h+QlVqFXX9xvUYhdpZD2rqJG0+w72Z6kpVq60sD968OZiuVtMj"
    "g4MjSlOdpCs3DlB5qFYbyiwvZ8rUf4YODaivaFKrVLT709YNlelkLaeRpEZGfuKsNxN1riBXqt5o1DnwTj0hVynllQuUisToinedluu+SHekLlJF"
    "KVh7ClkBWTGv2lGp8urtYSm6rIksmkXUzrsV5gPJWpJ/ylLJWnK5r+0sYnfiV2igvkx0Kcicz+Mv+gpn/q3OReR66JrUu0/pOi9ARkmB5RKlKDG6"
    "5F2poThtqYvUUUrWuUd4vfyspczLKzWpuqyJLNpO1nxAu1Hhn7JUspZn6OiVzhoGSfMKTvL0enfSfBp/zcPt7+S+H8JO19f9HMdzfp/3RZ/XXRVX"
    "rprnbVdVM5bR0BKGRFfJiLiS/aRW1yXGVX3Pcd1nkRH7fvI/XtINrZqRNLynlpd0UmtoXrrS9hq3K+n9/rr5a0n3ptt9rDfF3Y/oPwEZabbK"
)
_WILD = (
    "eNrtnF9oW9cdx7/nSrqSr2Xp3hvJjpPNdpy0iwlmdmSncVtVJ07bhCUbrpMtsJlosi0PEVt2YjtLMgbeitcRBspDXxzYHuK2D4G6hMIQo7GCMvoH"
    "nEIfhkdhUD+sMFJYH+p0GwPv97tHkm26UljJS3Y+cHTuPTr3nPM55/zOg7iorf/ZH4D4iJIFhTh86HDP2FhXtnPk8OHuzp7e4ZHOvpHu4c6xnq7u"
    "vtFs4om+0W6vIiU/pZ/mxkdtyk9fyGbTY+OTmZl0b7onneA6lyuNZk6o3D6lcpNSkFIDpbHceDY9PDx5KT2RuRSggovZkUQuTBfRSq3oF2vm8ttq"
    "/mNjY6PSFexqzZHJiakL2enp3GSe+5ueuZDL/yROV8Pjk9MjbQfaMiMzuYvZtouZ8dnstFN9bDQ7nrmcHU2TySj3mq6WcEELFRjVmeJW8YFP3Q1V"
    "8ki1nYnsRHr48kx2mkeay88c6gnRRehs3fZRXpy8lB2nsc7mZ7ZV9D4qU5zPTGQ3FaqTztPy/XxubPLCxKmRzHj2u5kp9cinqYebf/SFXHi5lKhO"
    "z6eb66HRaDQajUaj0Wg0Go3m4SP0FGg0Go1Go9FoNBqNRqN52NiV3BAJfnXB+0HC1tOi0TzS+L6qws4tB4P3blStTKZU2kT/iqnRaDQajUaj0Wg0"
    "Go1Go9FoNBqNRqPRaDQazSPAl71F9FUvBugXBx5tDD0F/9/EthwMfDL4a2UytVHj843/BdwRdbTDutwQtW8P4AjsOXXs/Bj2NYkB6qytX8qyQIYK"
    "AzDasJ+73o85G/65r9u/eM9Xldvj/3cQ4MRlLPgZpVY+35pbY3A7InCPBxEwEF+ycOo4khiLYEciBNPAjlfqYVvdMBrg3N0B57wJB09BzuPeWhh7"
    "MGhyIFnzJEhtmxDfRoMBx3LRdR54np/rApIBCAO+p7huW7Fg8l3j9ddh/oUHErPWIfrhDHXC/5bX0AOT+268Xo+ogaj/AQwK1jx/inPw0aiKIa/e"
    "vbeBRmHGEXwfIQP+F8VB4LghfAfRVLhBAx8E9mKuuuCb3vPkPUTea8r7GHmvwdrqPUXeq8p7nbyTFe/7WLnC3sWt3ks171XyTm56W1u9W8rKe6Hm"
    "vaq8CzXv/cp74Uu9W5T3yn/zXlPeZfJe3e4dJuVWyd73ybtA3v9S3nvI+0N5Rr5G3m8q75/XI/NiRkrZQOYhsv4OJUnmjjwZI3O57JnbBwLcs9vU"
    "APdXQVjkvhjFL25KeZqe3Uv2Up7x7J2XPO09gfUgPxj7Zwe67sgrNhe6f/oenL830IBN2L8M4Ag9SzPN2ZCaimY1Fc1X9yI+G4H5Ojf81wBPiXPy"
    "cwz+jqrOO94Tx0xegvjHLtwrUeEGHPT3SrlgQXwI+2QI12SVW7wP+K/Hmpdj8EXQ/EycDRLLqZIDXyeCNKW7IHaTeDOcOyYCzRBhoAUU1CKIOosX"
    "wzjEQ/OZT+BIKpV62kSI1qMVbcvJ3Tw8/yDfiffglHzwf4ZQCxuHHUR3iToaqNUJ3wNuIWj8UKAX0QOI4DFu2LkdAq1k6A3Ek42YSim+7olint5y"
    "IqDy1uTpyonwR0rkiETH0JiNowVgtZ4lXCvIy9x+/F4H3LtxCpog6mlZOmyYR4E+bx3OB+FQ6PtpcV+p423/swDCBr7R6nDWUVhy4Y8gbg3AnOMt"
    "8JyF63ib1UVsMEER1wLj90jQDt6JrsH5YpQXQLTjW/c+cXld3MF2b6b9t7i7pkKfoLu61layE3+DlUKs8CwGWO2TmsdQgT3KwKLyWFUeayvksU4e"
    "BeUxtNUjSR5LymPK84gpj3nlUT6mPFZrHqtYqHoUt3pcIY/i/Zaax8oLyqO4zaNc8Zjf9ChXPF74mD0oYhPRMnvQPr6mPBY9j2tPhmkbz0r5bpzG"
    "KW8Eeec3Fmh8R9E7J38TpxPYgv1SHMLyovW3XsS4eS9Sd52LIkJC62sxFupflHKpGe7JIG++6UW5QG3/OsJDxcBZul7ZCXtaBedVEwkK8RPoarkV"
    "qPmFi57fk2flTQdNiEIZHpyVd+u4mXDynNzbDtwQgUuCx0FHwZQKxT+Xq6bLqZSNnpKUSvQZT7S7VJKP8385tsuUkkx6kk2lAzB60Vj6JsQJDkmS"
    "DNZ7J8ayd2L4OpZv76SDEfG3BmCdgfP0dVgx1JHTqxCn4N8HXmEK0yL2lVIur7qw0Vq6iWDILyhS/T/ir0WSD8rdyau8VgEn9Q6L4g/go40KXsYA"
    "W5T+AxiSErE="
)
_TWO = (
    "eNrt2k1u00AUwPGk4aNCfIRF917RBYrUYiewQ0KwDJuWbkfj8TNYsj2V7UbpBnEErsIJuABLDtAjcARmartNUoGoEEiV/j/p6dmjN/bLRPLqBa9e"
    "Hw2cMxf3Bq1hODNJaJJ0Mt2P9ydRFOmJThIzmc3SZyJm73kyTXzhlouRC1vK2KXDSkSludWNmqpIhb5k2T3z25M2v9lt8x0Xd108cJFmuag4tktV"
    "6OVtt7AQE2b3fScrsVGZlWuVq8Z9pbHFcSV1ndnSv69uqqx8v+Ou4tzWJngaaNNkCwkWOj+R+nG/LZFcn0qi3C9J/FtVv+IXdrp2Lrzo8sN+eyGF"
    "ik8bqX2DWdnMom138fnLrfXmFnYpuWvxpGzWCre75/nyUhdy2Xl31I9celdmqa2KA6NzmevjdsePl/82n13J7UF8Or8fbvwLm/cAAAAAAAAAAAAA"
    "AOAGGnd5axiejz4MuzUGAwA+DFc+DKNRu97n6/rb/YO9lcYCl4PLta+/Cz+/ZZsPUv1qCu5jN/X2fd7m+ds2MwV3/Sm4i8NmDg4AAAAAAAAAAAAA"
    "APwvzMEB+OMPw42dg/sJCv7meA=="
)
BALL, HALF, WILD, TWO = map(_unpacked, (_BALL, _HALF, _WILD, _TWO))
