// The page as a whole: its figures, their buttons and keys, light and dark theme.
const DATA=JSON.parse(document.getElementById('figures').textContent),FIGURES=DATA.figures;
root.classList.add('scripted');
function button(parent,text,title,act){
  const b=document.createElement('button');
  b.type='button';b.textContent=text;b.title=title;b.addEventListener('click',act);
  parent.append(b);return b;
}
function save(name,type,content){
  const a=document.createElement('a');
  a.href=URL.createObjectURL(content instanceof Blob?content:new Blob([content],{type}));
  a.download=name;a.click();
  setTimeout(()=>URL.revokeObjectURL(a.href),1e4);
}
function png(figure,element){
  const image=new Image();
  image.onload=()=>{
    const canvas=document.createElement('canvas');
    canvas.width=2*image.width;canvas.height=2*image.height;
    canvas.getContext('2d').drawImage(image,0,0,canvas.width,canvas.height);
    canvas.toBlob(b=>save(figure.name+'.png','image/png',b));
  };
  image.src='data:image/svg+xml;charset=utf-8,'+encodeURIComponent(svgOf(figure,element));
}
for(const figure of FIGURES){
  const element=document.getElementById('fig-'+figure.name),tools=document.createElement('div');
  tools.className='tools';
  button(tools,'whole','show the whole figure again (0, double click)',()=>{for(const c of enliven(element,figure))c.whole()});
  button(tools,'csv','the numbers in view',()=>save(figure.name+'.csv','text/csv',csvOf(figure,element)));
  button(tools,'svg','the view as vectors',()=>save(figure.name+'.svg','image/svg+xml',svgOf(figure,element)));
  button(tools,'png','the view as a picture',()=>png(figure,element));
  button(tools,'link','copy a link to this view',()=>{
    const to=location.href.split('#')[0]+(element.dataset.fragment||'#fig-'+figure.name);
    navigator.clipboard?.writeText(to).catch(()=>{});
    history.replaceState(null,'',to.slice(to.indexOf('#')));
  });
  for(const key of['x','y'])if(figure.panels.some(p=>p.marks.some(m=>!m.cells&&!m.scene)&&canSpread(p,key))){
    const panels=figure.panels.filter(p=>canSpread(p,key));
    const b=button(tools,'log '+key,`${key==='x'?'horizontal':'vertical'} axis: logarithmic or linear`,()=>{
      const to=panels[0][key].scale==='log'?'linear':'log';
      for(const c of enliven(element,figure))if(c instanceof Chart&&canSpread(c.panel,key)){c.spread(key,to);remember(c)}
      b.setAttribute('aria-pressed',String(to==='log'));
    });
    b.setAttribute('aria-pressed',String(panels[0][key].scale==='log'));
  }
  element.querySelector('.say').after(tools);
  for(const item of element.querySelectorAll('.legend li')){
    const b=document.createElement('button');
    b.type='button';b.title='click: hide or show; double click: show alone';b.setAttribute('aria-pressed','true');
    b.append(...item.childNodes);item.append(b);
    b.addEventListener('click',()=>toggle(figure,element,item.dataset.name,false));
    b.addEventListener('dblclick',()=>toggle(figure,element,item.dataset.name,true));
  }
  keysOf(element,figure);
}
const near=new IntersectionObserver(entries=>{
  for(const entry of entries)if(entry.isIntersecting){
    near.unobserve(entry.target);
    enliven(entry.target,FIGURES.find(f=>f.name===entry.target.dataset.figure));
  }
},{rootMargin:'600px'});
for(const element of document.querySelectorAll('figure[data-figure]'))near.observe(element);
const repaint=()=>{for(const charts of alive.values())for(const c of charts)if(c.plot)c.plot.redraw()};
const shown=button(document.getElementById('page-tools'),'light / dark','light, dark, or as set in the system',()=>{
  const dark=root.dataset.light?root.dataset.light==='dark':matchMedia('(prefers-color-scheme: dark)').matches;
  root.dataset.light=dark?'light':'dark';
  repaint();
});
matchMedia('(prefers-color-scheme: dark)').addEventListener('change',repaint);
addEventListener('beforeprint',()=>{for(const d of document.querySelectorAll('details.methods'))d.open=true});
addEventListener('hashchange',recall);
recall();
// for the tests
window.report={ticks,alive,enliven,FIGURES,svgOf,csvOf,held,zoomed,Chart,arms:()=>small};
